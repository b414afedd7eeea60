"""The room of agents: eight verbs that a language model may ask of gfor, over the Model Context Protocol.

`verbs` lists them and asks a command in a process of its own (`question`), which reads nothing outside of the given
folders (`guard`), ends within a time, and answers in JSON; `answers` says what of that an agent gets, with units;
`server` offers the verbs.
"""
