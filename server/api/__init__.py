"""REST: one router per resource. Handlers validate, call, and return a view; blocking ones run in threads."""
