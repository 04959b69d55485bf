"""The figures of docs/paper.md, each drawn from scenario files by a function of its own."""
