"""The lift under test: a thread, a coroutine, and a class with methods."""

from parcours.study import took


class Panel:
    def run(self, port):  # in a thread of its own
        while True:
            channel, message = port.receive()
            if channel == "call":
                port.took("p1", request=message)
            elif channel == "arrived":
                port.took("p2", lamp=message)


class Cabin:
    floor = 0

    async def run(self, port):  # in an event loop of its own
        while True:
            _, request = await port.receive()
            if request["floor"] == self.floor:
                await port.took("c4", arrived={"floor": self.floor})
            else:
                await self.drive(port, request["floor"])

    async def drive(self, port, target):
        await port.took("c1", close={"hold": 0.5})
        while True:
            _, door = await port.receive()
            if door["shut"]:
                self.floor = target
                await port.took("c2", arrived={"floor": target})
                return
            await port.took("c3", close={"hold": 2.0})


class Door:
    blocked = False  # an input variable of the model: the tester sets it before each turn

    def close(self, message):
        return took("d1", door={"shut": False}) if self.blocked else took("d2", door={"shut": True})

    def d3(self):  # no message starts it: the tester asks for it by name
        return took("d3")
