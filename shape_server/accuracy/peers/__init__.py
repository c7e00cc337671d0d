"""What accuracy costs elsewhere: the programs that a user would pick instead, on motions that they can follow, and their references."""
