"""The command line of circlepose, installed as `circlepose_cli`: it parses, calls the library and prints."""
