"""Pages of the documentation, programs of its gallery and the tools that build the site."""
