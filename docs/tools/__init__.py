"""Tools that build the site: hooks of mkdocs, pictures, pages of the API, formulas, notebooks."""
