"""Commands that are ended at any moment: what they leave behind is whole, old or new."""
