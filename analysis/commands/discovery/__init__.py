"""Commands that tell what there is: scenarios, laws, fields, and the installation."""
