"""The pictures of a gap: the numbers behind them, and the page, the terminal and the maps that show them."""
