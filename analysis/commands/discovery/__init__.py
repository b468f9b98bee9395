"""Commands that list scenarios, laws and fields, and that check the installation."""
