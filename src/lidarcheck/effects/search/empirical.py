"""The KPIs that watch empirical terms: they describe what no effect explains, and no search looks for them."""

from lidarcheck.effects.search.base import SearchSpec

SPECS = (
    SearchSpec("empirical_flicker", watched_by=("area_spread", "area_mean", "detection_probability")),
    SearchSpec("empirical_signal", watched_by=("area_mean", "detection_probability", "peak_mean")),
    SearchSpec(
        "empirical_range",
        watched_by=("range_residual_mean", "range_residual_per_metre", "range_residual_per_decade"),
    ),
    SearchSpec("empirical_spread", watched_by=("range_noise",)),
    SearchSpec("empirical_loss", watched_by=("detection_probability", "echo_share", "multi_echo_share")),
    SearchSpec(
        "empirical_extra",
        watched_by=("false_alarms_per_beam", "multi_echo_share", "echo_range_mean", "echo_area_mean"),
    ),
    SearchSpec("empirical_amplitude", watched_by=("area_mean", "peak_mean", "width_mean")),
)
