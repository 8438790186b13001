"""The coupler: scenarios, FMI import, schemes, recording and the command line.  It never imports a half."""
