"""A hundred nonsmooth problems with known answers, and this library and others run on them."""
