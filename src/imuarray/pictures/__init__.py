"""Pictures of recordings and answers, each drawn into axes, and their style."""
