"""Numbers of command lines, within their range."""
import argparse


def between(kind, low, high):
    """A type of argparse: a number from `low` to `high`."""
    def number(text):
        try:
            value = kind(text)
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            raise argparse.ArgumentTypeError(f"'{text}' is not a number from {low} to {high}")
        return value
    return number
