"""How particles move, enter and leave."""
