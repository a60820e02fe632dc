"""How accurate a camera, a target and a distance will be, before anything is bought."""
