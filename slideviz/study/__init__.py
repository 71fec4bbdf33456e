"""Methods compared with each other: tables, plots and montages."""
