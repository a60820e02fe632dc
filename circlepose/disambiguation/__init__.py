"""From two candidate poses of a lone circle to one, by what is known of the scene."""
