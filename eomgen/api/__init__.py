"""What a user holds: a model, its equations, its module."""
