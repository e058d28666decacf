"""What effects need to know of beams, surfaces and where light goes: footprints, planes, reflections, own rays."""
