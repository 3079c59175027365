"""Ctrl-C at a given call of a function, and what a progress bar is given."""


def interrupt(monkeypatch, owner, name, calls, *, once=False):
    """Let a function of a module or class raise KeyboardInterrupt after some calls, always or once."""
    plain, count = getattr(owner, name), [0]

    def counted(*args, **options):
        count[0] += 1
        if count[0] == calls + 1 or (count[0] > calls and not once):
            raise KeyboardInterrupt
        return plain(*args, **options)

    monkeypatch.setattr(owner, name, counted)


def watch_progress(monkeypatch, module):
    """What a module gives its progress bars: the options, and the parts until they are closed."""
    parts, options = [], []

    class Bar:
        def update(self, part=1):
            parts.append(part)

        def close(self):
            parts.append("closed")

    monkeypatch.setattr(module, "progress_bar", lambda *given: options.append(given) or Bar())
    return parts, options
