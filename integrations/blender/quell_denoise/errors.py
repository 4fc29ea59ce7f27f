# SPDX-License-Identifier: GPL-3.0-or-later
"""The one error of this extension."""


class Problem(Exception):
    """What went wrong and what to do, in words for the user."""
