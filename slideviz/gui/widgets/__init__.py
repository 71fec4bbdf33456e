"""Fields, lists, plots and icons that the panels are made of."""
