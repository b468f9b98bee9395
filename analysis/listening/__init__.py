"""Sources while they sound: streams of sound, what is wrong with them, and views."""
