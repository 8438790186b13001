"""Small thermal halves: heat on the columns of rods and on whole bodies."""
