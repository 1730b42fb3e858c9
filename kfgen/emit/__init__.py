"""From scheduled programs to C text: names, the printer, the view that templates see."""
