"""What is touched: the only room that speaks Qt."""
