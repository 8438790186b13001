"""Laws that every run keeps: balances of heat and energy, equations solved, temperatures and tables within data."""
