"""A plant that carries nobody: the loop by itself."""


class Nowhere:
    def advance(self, step):
        pass

    def enter(self, row, arrival, step):
        pass

    def follow(self, row, pieces, merge_time_s):
        pass
