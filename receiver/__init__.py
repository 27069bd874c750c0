"""The set-top box: from a programme to a cuer on the screen."""
