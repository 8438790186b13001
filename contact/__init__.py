"""Contact as a shared service, and what every half is made of (contact.half)."""
