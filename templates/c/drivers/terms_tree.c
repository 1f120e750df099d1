#define terms_block tree_terms
