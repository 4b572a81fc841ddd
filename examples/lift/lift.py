"""The lift under test: a class for each component, a method for each message."""

from parcours.study import took


class Panel:
    def call(self, message):
        return took("p1", request=message)

    def arrived(self, message):
        return took("p2", lamp=message)


class Cabin:
    def __init__(self, slow_close=2.0):
        self.floor, self.slow_close = 0, slow_close

    def request(self, message):
        if message["floor"] == self.floor:
            return took("c4", arrived={"floor": self.floor})
        self.target = message["floor"]
        return took("c1", close={"hold": 0.5})

    def door(self, message):
        if not message["shut"]:
            return took("c3", close={"hold": self.slow_close})
        self.floor = self.target
        return took("c2", arrived={"floor": self.floor})


class Door:
    blocked = False  # an input variable of the model: the tester sets it before each turn

    def close(self, message):
        return took("d1", door={"shut": False}) if self.blocked else took("d2", door={"shut": True})

    def d3(self):  # no message starts it: the tester asks for it by name
        return took("d3")
