"""Tables that can be pasted into a page of docs."""


def row(*cells):
    """Print one row of a table."""
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def head(*cells):
    """Print the head of a table."""
    row(*cells)
    row(*["---"] * len(cells))
