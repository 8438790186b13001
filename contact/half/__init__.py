"""What every half is made of: its FMI face, state, interface file, signals, properties and sparse solve."""
