"""Commands on recorded studies: import, export, identification and discovery."""
