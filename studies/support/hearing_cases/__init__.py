"""Cases of hearing for ``studies.hearing_cases``: each module holds one kind."""
