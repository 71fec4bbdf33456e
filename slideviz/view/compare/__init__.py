"""One case by several methods: computed, tabled, plotted."""
