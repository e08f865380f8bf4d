"""How good it is beside others: speed beside error, against whatever else can do the same."""
