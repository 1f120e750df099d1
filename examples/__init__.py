"""Example models, shipped as the package ``eomgen.examples``; ``eomgen examples`` lists them."""
