"""The screens, a file each: what stands in `core.actions.SCREENS` by its name."""
