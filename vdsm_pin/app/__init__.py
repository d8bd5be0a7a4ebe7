"""What commands do, from files to folders."""
