"""What developers run: mutation testing, schemas that are shipped."""
