!> The table of bond laws: a line for each. A program that uses the library adds its own to a copy
!> of it.
module pd_law_laws
  use pd_base_error, only: internal_fault
  use pd_law_law, only: bond_law_type, law_name_length, parameter_type
  use pd_law_lps, only: lps_law
  use pd_law_lps_plastic, only: lps_plastic_law
  use pd_law_lps_plastic_large, only: lps_plastic_large_law
  use pd_law_softening, only: softening_law
  use pd_law_weighted, only: bond_based_law, state_based_law
  implicit none (type, external)
  private
  public :: law_item_type, law_table_type, all_laws

  !> A law in a list.
  type :: law_item_type
    class(bond_law_type), allocatable :: law
  end type law_item_type

  !> Laws by their names.
  type :: law_table_type
    type(law_item_type), allocatable :: items(:)  !! in the order of the reference
  contains
    procedure :: add
    procedure :: number_of
    procedure :: names
    procedure :: parameters
  end type law_table_type

contains

  !> All laws of the program.
  function all_laws() result(table)
    type(law_table_type) :: table

    call table%add(state_based_law())
    call table%add(bond_based_law())
    call table%add(lps_law())
    call table%add(lps_plastic_law())
    call table%add(lps_plastic_large_law())
    call table%add(softening_law())
  end function all_laws

  !> Add a law; one of the same name is replaced.
  subroutine add(self, law)
    class(law_table_type), intent(inout) :: self  !! with the law on return
    class(bond_law_type), intent(in) :: law       !! is copied
    type(law_item_type), allocatable :: items(:)
    integer :: i, n

    if (law%name == '') call internal_fault('a bond law without a name')
    if (.not. allocated(self%items)) allocate (self%items(0))
    n = self%number_of(law%name)
    if (n > 0) then
      deallocate (self%items(n)%law)
      allocate (self%items(n)%law, source=law)
      return
    end if
    n = size(self%items)
    allocate (items(n + 1))
    do i = 1, n
      call move_alloc(self%items(i)%law, items(i)%law)
    end do
    allocate (items(n + 1)%law, source=law)
    call move_alloc(items, self%items)
  end subroutine add

  !> The number of the law of a name; 0 if there is none.
  pure integer function number_of(self, name) result(number)
    class(law_table_type), intent(in) :: self  !! the table
    character(*), intent(in) :: name           !! of a law
    integer :: i

    number = 0
    do i = 1, size(self%items)
      if (self%items(i)%law%name == name) number = i
    end do
  end function number_of

  !> The names of all laws.
  pure function names(self)
    class(law_table_type), intent(in) :: self  !! the table
    character(law_name_length), allocatable :: names(:)
    integer :: i

    allocate (names(size(self%items)))
    do i = 1, size(names)
      names(i) = self%items(i)%law%name
    end do
  end function names

  !> The keys of all laws, each once, not given.
  function parameters(self) result(all)
    class(law_table_type), intent(in) :: self  !! the table
    type(parameter_type), allocatable :: all(:)
    integer :: i, j

    allocate (all(0))
    do i = 1, size(self%items)
      associate (law => self%items(i)%law)
        if (.not. allocated(law%parameters)) cycle
        do j = 1, size(law%parameters)
          if (any(all%name == law%parameters(j)%name)) cycle
          all = [all, law%parameters(j)]
        end do
      end associate
    end do
  end function parameters

end module pd_law_laws
