"""A judged run as one page: values in, JSON values out, and the template that shows them."""
