"""x"""


def live(): ...
