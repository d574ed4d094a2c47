"""What the commands do, from the files that they read to the files that they leave."""
