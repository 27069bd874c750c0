"""Reading programmes: containers to samples and luma on the programme's clock."""
