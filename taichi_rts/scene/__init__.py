"""What is simulated, as a frozen description, and all that is known of it without a device."""
