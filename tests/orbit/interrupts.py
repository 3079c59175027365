"""Ctrl-C at a given call of a function."""


def interrupt(monkeypatch, owner, name, calls, *, once=False):
    """Let a function of a module or class raise KeyboardInterrupt after some calls, always or once."""
    plain, count = getattr(owner, name), [0]

    def counted(*args, **options):
        count[0] += 1
        if count[0] == calls + 1 or (count[0] > calls and not once):
            raise KeyboardInterrupt
        return plain(*args, **options)

    monkeypatch.setattr(owner, name, counted)
