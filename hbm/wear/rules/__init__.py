"""The wear rules of the product, one a file."""
