"""The papers' figures and tables, drawn from tables alone.

Each figure is two functions: one makes the table of exactly the numbers that are plotted (it
becomes the CSV), the other draws that table. Neither simulates nor samples anything.
"""
