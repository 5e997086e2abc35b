"""ClientError: whatever keeps a server from doing what it was asked, in one type."""


class ClientError(Exception):
    """A server refused, did not answer in time, or said something that makes no sense.

    Parameters
    ----------
    text : str
        What is wrong, for the operator.
    code : str
        For programs: that of the problem document, ``unreachable``, ``no_answer`` or ``not_delivered``; may be empty.
    remedy : str
        What to do about it; may be empty.
    status : int
        HTTP status; 0 where there was no answer.
    """

    def __init__(self, text: str, code: str = "", remedy: str = "", status: int = 0) -> None:
        super().__init__(f"{text}: {remedy}" if remedy else text)
        self.text = text
        self.code = code
        self.remedy = remedy
        self.status = status

    @property
    def is_bad_input(self) -> bool:
        """The request itself cannot be obeyed, now or later."""
        return self.status in (400, 404, 413, 422)
