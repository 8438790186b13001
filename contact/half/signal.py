"""Has moved to contact.half.functions; what a half needs of it is public in contact.half."""

from contact.half.moved import moved

__getattr__ = moved(__name__, "contact.half.functions")
