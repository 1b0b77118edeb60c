"""One function per stage of a study; each calls the packages and says what it made."""
