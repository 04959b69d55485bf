"""Placeholder until the views are here."""


class Worker:
    def make(self, record, target): ...
    def news(self):
        return []
    def finish(self): ...
