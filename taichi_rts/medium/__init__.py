"""What the fluid is made of: kernel functions, equation of state, mass, energy."""
