"""One paper reproduced and four models after papers, one folder each, on the library's public names.

Only ``biber_2022`` was read, so only it is called a reproduction. The statements of the others are
quoted from memory, and each row of their tables says so.
"""
