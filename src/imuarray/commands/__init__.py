"""The command line: each command reads, calls one function of the package, writes and reports."""
