"""Does a half keep to the border of docs/design.md?  `slideline verify-half` tells (docs/verify_half.md)."""
