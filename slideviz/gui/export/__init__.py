"""The dialogs through which pictures, films and meshes leave the window."""
