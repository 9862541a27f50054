"""What an author pastes into a section of methods: the task, the fits and how well they fit."""
