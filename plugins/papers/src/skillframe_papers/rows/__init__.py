"""How each row is computed, a module a subject. `published` names the function of each."""
